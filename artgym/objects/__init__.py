"""What an articulated object is, and where objects come from."""
