"""Labels: static, part or hand for every pixel."""
