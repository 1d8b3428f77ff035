"""Which way is up, once the surfaces and the parts are known."""
