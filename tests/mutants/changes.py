"""Finds the changes that could be made to a source: one operator, one condition or one early return each."""
import hashlib
import re

from tokens import ASSIGNMENTS, BINARY, CLOSING, tokens_of

OPERATORS = {"<": ("<=", ">="), "<=": ("<", ">"), ">": (">=", "<="), ">=": (">", "<"), "==": ("!=",), "!=": ("==",),
             "&&": ("||",), "||": ("&&",), "+": ("-",), "-": ("+",), "*": ("+",), "/": ("*",), "%": ("/",),
             "<<": (">>",), ">>": ("<<",), "&": ("|",), "|": ("&",), "^": ("|",), "+=": ("-=",), "-=": ("+=",),
             "*=": ("+=",), "|=": ("&=",), "&=": ("|=",), "<<=": (">>=",), ">>=": ("<<=",)}
STOPS = {",", ";", "?", ":", "return", "case", "throw", "else", "do", "co_return"}
ON = "::nodal::mutants::on({number})"


class Change:
    """`parts` replaces the characters [start, end): texts, and spans of the source as (start, end)."""

    def __init__(self, what, start, end, parts, at):
        self.what, self.start, self.end, self.parts, self.at = what, start, end, parts, at
        self.path = self.line = self.number = self.line_number = None

    def __str__(self):
        return f"{self.path}:{self.line_number}: {self.what}\n    {self.line}"


class Source:
    """One source and its changes."""

    def __init__(self, path, text):
        self.path, self.text, self.tokens = path, text, tokens_of(text)
        self.changes = []
        for first, last in self.function_bodies():
            self.search(first, last)
        self.name_changes()

    def function_bodies(self):
        """Index ranges of tokens between the braces of functions outside of functions."""
        index, statement = 0, 0
        while index < len(self.tokens):
            token = self.tokens[index]
            if token.kind == "directive" or token.text in (";", "}") or token.text in ("public", "private", "protected"):
                statement = index + 1
            elif token.text == "{" and token.kind == "sign" and token.partner is not None:
                words = [t.text for t in self.tokens[statement:index]]
                scope = {"namespace", "struct", "class", "enum", "union", "extern"} & set(words) and "(" not in words
                if scope or not words:
                    statement = index + 1
                else:
                    if "(" in words and not (token.block is False and "=" in words):
                        yield index + 1, token.partner
                    index = token.partner
                    closed_initializer = index + 1 < len(self.tokens) and self.tokens[index + 1].text in (",", "{")
                    if not closed_initializer:
                        statement = index + 1
            index += 1

    def search(self, first, last):
        index = first
        while index < last:
            token = self.tokens[index]
            if self.is_checked_or_constant(index):
                index = self.end_of_statement(index)
                continue
            if token.text == "<" and token.partner is not None:
                index = token.partner  # arguments of a template are constants
            elif token.text == "if" and token.kind == "word":
                self.condition_of_if(index)
            elif token.text == "NODAL_TRY":
                self.error_passed_on(index)
            elif token.text == "while" and self.tokens[index + 1].text == "(":
                self.negation("the loop's condition is negated", index + 2, self.tokens[index + 1].partner, index)
            elif token.text == "?" and token.kind == "sign":
                self.negation("the choice is negated", self.left_of(index, -1), index, index)
            elif token.text == "!" and token.kind == "sign":
                self.dropped_not(index)
            elif token.binary and token.text in OPERATORS:
                self.operator(index)
            elif token.text in ("return", "break", "continue") and token.kind == "word":
                self.end_of_block(index)
            index += 1

    def is_checked_or_constant(self, index):
        """An assertion, or what only a compiler evaluates."""
        text = self.tokens[index].text
        after = self.tokens[index + 1].text if index + 1 < len(self.tokens) else ""
        return (text in ("static_assert", "constexpr", "using", "case", "consteval") and
                not (text == "constexpr" and after == "(")) or text.endswith(("_ASSERT", "_CHECK")) or text == "assert"

    def end_of_statement(self, index):
        while self.tokens[index].text not in (";", ":", "}"):
            token = self.tokens[index]
            index = token.partner + 1 if token.partner is not None and token.partner > index else index + 1
        return index

    # Ends of operands.

    def left_of(self, index, level):
        """The index of the first token of the operand on the left of the operator at `index`."""
        at = index - 1
        while at >= 0:
            token = self.tokens[at]
            if token.text in CLOSING and token.partner is not None and token.kind == "sign":
                if token.block:
                    break
                at = token.partner - 1
                continue
            if token.partner is not None or token.text in STOPS or token.kind == "directive" or token.text == "{":
                break
            if token.binary and BINARY.get(token.text, -1) < level or token.text in ASSIGNMENTS:
                break
            at -= 1
        return at + 1

    def right_of(self, index, level):
        """The index behind the last token of the operand on the right of the operator at `index`."""
        at = index + 1
        while at < len(self.tokens):
            token = self.tokens[at]
            if token.partner is not None and token.partner > at:
                at = token.partner + 1
                continue
            if token.partner is not None or token.text in STOPS or token.kind == "directive":
                break
            if token.binary and (BINARY.get(token.text, -1) <= level or token.text in ASSIGNMENTS):
                break
            at += 1
        return at

    def span(self, first, last):
        return self.tokens[first].start, self.tokens[last - 1].end

    def add(self, what, first, last, parts, at):
        inside = self.tokens[first:last]
        if first < last and all(token.kind != "directive" for token in inside):
            self.changes.append(Change(what, *self.span(first, last), parts, self.tokens[at].start))

    # Changes.

    def operator(self, index):
        sign = self.tokens[index].text
        if "string" in (self.tokens[index - 1].kind, self.tokens[index + 1].kind) and sign in ("+", "<<", "+="):
            return
        level = BINARY.get(sign, -1)
        first, last = self.left_of(index, level), self.right_of(index, level)
        if first == index or last == index + 1:
            return
        left, right = self.span(first, index), self.span(index + 1, last)
        for other in OPERATORS[sign]:
            self.add(f"{sign} becomes {other}", first, last,
                     [f"({ON} ? (", left, f" {other} ", right, ") : (", self.span(first, last), "))"], index)

    def negation(self, what, first, last, at):
        if first >= last or any(token.text == "=" for token in self.tokens[first:last]):
            return
        condition = self.span(first, last)
        self.add(what, first, last, [f"({ON} ? !(", condition, ") : static_cast<bool>(", condition, "))"], at)

    def dropped_not(self, index):
        last = self.right_of(index, 11)
        if last == index + 1:
            return
        self.add("! is dropped", index, last, [f"({ON} ? static_cast<bool>(", self.span(index + 1, last), ") : ",
                                               self.span(index, last), ")"], index)

    def condition_of_if(self, index):
        """A negated condition, and an early return that is never taken."""
        opening = index + 1
        if self.tokens[opening].text != "(" or self.tokens[opening].partner is None:
            return  # if constexpr
        closing = self.tokens[opening].partner
        first = opening + 1
        depth_0 = list(self.at_depth_0(first, closing))
        for at in depth_0:
            if self.tokens[at].text == ";":
                first = at + 1
        equals = [at for at in depth_0 if at >= first and self.tokens[at].text == "="]
        leaves = self.tokens[closing + 1].text in ("return", "continue", "break")
        if not equals:
            self.negation("the condition is negated", first, closing, index)
            if leaves:
                condition = self.span(first, closing)
                self.add(self.never(closing + 1), first, closing, ["(static_cast<bool>(", condition, f") && !{ON})"],
                         index)
            return
        name = self.tokens[equals[0] - 1]
        whole = self.span(first, closing)
        if name.kind == "word":
            self.add("the condition is negated", first, closing,
                     [whole, f"; {ON} ? !{name.text} : static_cast<bool>({name.text})"], index)
            if leaves:
                self.add(self.never(closing + 1), first, closing,
                         [whole, f"; static_cast<bool>({name.text}) && !{ON}"], index)

    def error_passed_on(self, index):
        """An error that NODAL_TRY() does not pass on. NODAL_TRY_ASSIGN() has no value to go on with."""
        first, last = index + 2, self.tokens[index + 1].partner
        self.add("the error is not passed on", first, last,
                 ["[&]() -> ::nodal::Status {{ auto nodal_result = (", self.span(first, last),
                  f"); if (nodal_result || {ON}) return {{{{}}}}; return ::nodal::fail(nodal_result.error()); }}}}()"], index)

    def at_depth_0(self, first, last):
        at = first
        while at < last:
            yield at
            token = self.tokens[at]
            at = token.partner + 1 if token.partner is not None and token.partner > at else at + 1

    def never(self, index):
        return f"the early {self.tokens[index].text} is never taken"

    def end_of_block(self, index):
        """The last statement of the block of an if, where the function goes on behind it."""
        last = self.end_of_statement(index)
        closing = last + 1
        if self.tokens[last].text != ";" or self.tokens[closing].text != "}" or closing + 1 == len(self.tokens):
            return
        opening = self.tokens[closing].partner
        behind = self.tokens[closing + 1].text
        before = self.tokens[opening - 1]
        if not self.tokens[closing].block or before.text != ")" or behind in ("}", "else", ")", ",", ";") or before.partner is None:
            return
        if self.tokens[before.partner - 1].text != "if" or self.tokens[index - 1].text in (")", "else"):
            return
        self.add(self.never(index), index, closing, [f"if (!{ON}) ", self.span(index, closing)], index)

    def name_changes(self):
        """Each change gets its line; those of one line that would be called the same get a number."""
        seen = {}
        self.changes.sort(key=lambda change: (change.at, change.what))
        for change in self.changes:
            begin = self.text.rfind("\n", 0, change.at) + 1
            end = self.text.find("\n", change.at)
            change.path, change.line = self.path, self.text[begin:end].strip()
            change.line_number = self.text.count("\n", 0, change.at) + 1
            key = (begin, change.what)
            seen[key] = seen.get(key, 0) + 1
            if seen[key] > 1:
                change.what += f" (number {seen[key]} of the line)"

    def changed(self, changes):
        """The source with a switch for each of `changes`, in as many lines as it has. Also the numbers in each line."""
        ordered = sorted(changes, key=lambda change: (change.start, -change.end, change.at))
        text = self.rendered(0, len(self.text), ordered, keep_lines=True)
        numbers = {}
        for at, line in enumerate(text.split("\n"), 1):
            numbers[at] = {int(number) for number in re.findall(r"mutants::on\((\d+)\)", line)}
        return text, numbers

    def rendered(self, start, end, changes, keep_lines):
        pieces, at = [], start
        while changes:
            change, changes = changes[0], changes[1:]
            inner = [other for other in changes if other.end <= change.end]
            changes = changes[len(inner):]
            pieces.append(self.plain(at, change.start, keep_lines))
            for part in change.parts:
                if isinstance(part, str):
                    pieces.append(part.format(number=change.number))
                else:
                    within = [other for other in inner if part[0] <= other.start and other.end <= part[1]]
                    pieces.append(self.rendered(*part, within, False).strip())
            if keep_lines:
                pieces.append("\n" * self.text.count("\n", change.start, change.end))
            at = change.end
        return "".join(pieces) + self.plain(at, end, keep_lines)

    def plain(self, start, end, keep_lines):
        """The text between; on one line and without comments where it is repeated."""
        if keep_lines:
            return self.text[start:end]
        tokens = [token for token in self.tokens if token.start >= start and token.end <= end]
        text, at = "", start
        for token in tokens:
            text += (" " if token.start > at and text or token.before else "") + token.text
            at = token.end
        return text + (" " if at < end else "")


def by_seed(changes, seed):
    """All changes in an order that depends on the seed and on each change, not on the rest of the tree."""
    seen = {}

    def key(change):
        name = f"{seed}|{change.path}|{change.line}|{change.what}"
        seen[name] = seen.get(name, 0) + 1
        return hashlib.sha256(f"{name}|{seen[name]}".encode()).hexdigest()

    return [change for _, change in sorted(((key(change), change) for change in changes), key=lambda pair: pair[0])]
