"""Self-contained pages: of a body, a response, a survey.

`body` (with `ring` for a cyclic one) and `response` say what is on a page, in the sentences of `words`; `page` holds
what a page can be made of, and the templates beside it how that looks.
"""
