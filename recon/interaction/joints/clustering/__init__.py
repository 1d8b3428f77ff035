"""Articulation-aware motion clustering: a line or an arc for each track, tracks of one joint together.

FunREC, supplement 3.2: the thresholds; clusters are seeds here.
"""
