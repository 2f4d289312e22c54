"""Responses of torque to rate, for each experiment that measures one: tables and figures too."""
