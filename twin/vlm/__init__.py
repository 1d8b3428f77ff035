"""Questions to a vision-language model: never asked unless the user does, kept on disk, checked before they
are used.

`client` talks to any OpenAI-compatible endpoint, `cache` keeps answers, `picture` chooses and marks what is
shown, `answer` reads what comes back, `estimate` weighs it against the geometry.
"""
