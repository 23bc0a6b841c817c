"""The words of a C++ source, with brackets that belong together.

Nothing is parsed. The tree is formatted by clang-format, so that spaces say what a parser would: a binary operator has
white space on both sides, an angle bracket of a template has none before it.
"""
import re

TOKEN = re.compile(
    r"""(?P<space>\s+)
      | (?P<comment>//[^\n]*|/\*.*?\*/)
      | (?P<directive>(?<![^\n])[ \t]*\#(?:[^\n\\]|\\.)*)
      | (?P<string>(?:u8|[uUL])?R"(?P<mark>[^(]*)\(.*?\)(?P=mark)"|(?:u8|[uUL])?"(?:[^"\\\n]|\\.)*")
      | (?P<number>\.?[0-9](?:'[0-9a-zA-Z]|[eEpP][+-]|[0-9a-zA-Z_.])*)
      | (?P<character>[uUL]?'(?:[^'\\\n]|\\.)+')
      | (?P<word>[A-Za-z_]\w*)
      | (?P<sign><=>|<<=|>>=|\.\.\.|->\*|->|::|\+\+|--|<<|<=|>=|==|!=|&&|\|\||[-+*/%&|^]=|.)""",
    re.VERBOSE | re.DOTALL)

CLOSING = {")": "(", "]": "[", "}": "{", ">": "<"}
BINARY = {"||": 0, "&&": 1, "|": 2, "^": 3, "&": 4, "==": 5, "!=": 5, "<": 6, "<=": 6, ">": 6, ">=": 6, "<=>": 7,
          "<<": 8, ">>": 8, "+": 9, "-": 9, "*": 10, "/": 10, "%": 10}
ASSIGNMENTS = {"=", "+=", "-=", "*=", "/=", "%=", "&=", "|=", "^=", "<<=", ">>="}


class Token:
    def __init__(self, kind, text, start):
        self.kind, self.text, self.start, self.end = kind, text, start, start + len(text)
        self.before = self.after = False  # white space on this side
        self.partner = None  # index of the bracket that belongs to this one
        self.block = False  # a brace around statements or declarations, not around values
        self.binary = False


def tokens_of(text):
    """The tokens without spaces and comments; a >> that closes two templates is two tokens."""
    found, at, space = [], 0, True
    while at < len(text):
        match = TOKEN.match(text, at)
        kind = match.lastgroup if match.lastgroup != "mark" else "string"
        if kind in ("space", "comment"):
            space = True
            if found:
                found[-1].after = True
        else:
            token = Token(kind, match.group(), at)
            token.before, space = space, False
            found.append(token)
        at = match.end()
    return with_partners(found)


def with_partners(found):
    tokens, open_ones = [], []

    def add(token):
        index = len(tokens)
        tokens.append(token)
        if token.kind != "sign":
            return
        before = tokens[index - 1].text if index else ""
        if token.text in "([{" or (token.text == "<" and opens_template(token, before)):
            open_ones.append(index)
        elif token.text in CLOSING and not (token.text == ">" and not closes_template(token)):
            while open_ones and tokens[open_ones[-1]].text != CLOSING[token.text]:
                open_ones.pop()
            if open_ones:
                token.partner = open_ones.pop()
                tokens[token.partner].partner = index

    def opens_template(token, before):
        return (before == "template" or not token.before) and not token.after and before != "operator"

    def closes_template(token):
        return not token.before and bool(open_ones) and tokens[open_ones[-1]].text == "<"

    for token in found:
        if token.text == ">>" and closes_template(token):
            for place in (0, 1):
                half = Token("sign", ">", token.start + place)
                half.after = place == 1 and token.after
                add(half)
        else:
            add(token)
    for index, token in enumerate(tokens):
        before = tokens[index - 1].text if index else ""
        if token.text == "{" and token.kind == "sign":
            token.block = before in (")", "else", "do", "try", "{", "}", ";", ":", "const", "noexcept", "override",
                                     "final", "mutable", "") or opens_scope(tokens, index)
            if token.partner is not None:
                tokens[token.partner].block = token.block
        token.binary = (token.kind == "sign" and (token.text in BINARY or token.text in ASSIGNMENTS) and token.before
                        and token.after and token.partner is None and before != "operator")
    return tokens


def opens_scope(tokens, index):
    """Whether the statement that ends in this brace is a namespace, type or function, not a value."""
    at = index - 1
    while at >= 0:
        token = tokens[at]
        if token.partner is not None and token.text in CLOSING:
            if token.text == "}":
                return False
            at = token.partner - 1
            continue
        if token.text in (";", "{", "}", "(", "[", ",", "="):
            return False
        if token.text in ("namespace", "struct", "class", "enum", "union", "->"):
            return True
        at -= 1
    return False
