"""The stages of a recording up to its fused scene, and pieces of minutes solved in processes of their own."""
