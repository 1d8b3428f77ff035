"""How whole an exported asset is, and whether it holds, stops and shows what the true furniture does."""
