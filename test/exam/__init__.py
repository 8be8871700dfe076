"""The exam of the diagnosis: robots that hide a known cause, and what the diagnosis says of them."""
