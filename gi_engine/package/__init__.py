"""Making the extension's package, from a checkout. Not part of the package itself, which never uses the network."""
