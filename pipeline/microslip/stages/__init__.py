"""What is made from what, and the only places that know an order of calls."""
