"""Settings files: what is wrong in one is said in a sentence a mistake; all of ``body.toml``."""
