"""What the machine really is: values of keys with which runs differ least from measured data."""
