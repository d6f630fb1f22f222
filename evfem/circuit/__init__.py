"""What the amplifier plays and sees: voltages over the position, encoding, signal files."""
