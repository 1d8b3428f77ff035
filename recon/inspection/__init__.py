"""What is wrong with a recording, told before anything is reconstructed, and how to record better."""
