"""Tables as text, whoever wrote them: encoding, separator, decimal sign, preamble, header, row of units."""
