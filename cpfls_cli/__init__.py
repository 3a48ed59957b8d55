"""cpfls: grey-box identification of multirotor rotational dynamics with continuous periodic fuzzy systems."""

__version__ = "0.1.0"
