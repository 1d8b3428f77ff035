"""The part-pose graph: axis and states from relative poses of the part between frames.

FunREC, supplement 1.4, eq. 3: same objective, confidences in closed form.
"""
