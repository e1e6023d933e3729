"""What commands share: options, quantities, what is printed, keys and meters."""
