"""Truth of one's own recording: marks on its pictures, joints and states that follow, a folder truth/."""
