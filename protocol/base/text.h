// Makes text from outside the program safe to pass on.
#pragma once

#include <cstddef>
#include <string>
#include <string_view>

namespace nodal {

/// `text` with every byte that is not part of well-formed UTF-8 (RFC 3629) replaced by U+FFFD. Text from devices and
/// files passes through this before it goes into a message, whose strings must be UTF-8.
std::string valid_utf8(std::string_view text);

/// Makes text from a peer, a file or a device safe for logs and terminals; all such text must pass through it. The
/// result is well-formed UTF-8 of at most `limit` bytes, cut between characters, with '?' for every character that
/// is_printable() refuses.
std::string printable(std::string_view text, std::size_t limit);

/// Whether `text` is well-formed UTF-8 without characters that move the cursor, end a line or change the displayed
/// order: control characters (U+0000 to U+001F, U+007F to U+009F), line and paragraph separators (U+2028, U+2029) and
/// bidirectional controls (U+061C, U+200E, U+200F, U+202A to U+202E, U+2066 to U+2069; Unicode UAX #9).
bool is_printable(std::string_view text);

}  // namespace nodal
