"""Robots: plan and replay, headless, what the person in the recording did."""
