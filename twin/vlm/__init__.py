"""Questions to a vision-language model: asked only by the user, kept on disk, checked before use.

`client` talks to any OpenAI-compatible endpoint, `cache` keeps answers, `picture` chooses and marks what is
shown, `answer` reads what comes back, `estimate` weighs it against the geometry.
"""
