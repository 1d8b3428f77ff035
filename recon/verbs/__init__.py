"""What the command line's verbs about recordings and twins do; it names them in its table."""
