// Text that came from elsewhere, made fit to pass on.
#pragma once

#include <cstddef>
#include <string>
#include <string_view>

namespace nodal {

/// `text` with every byte that is not part of well-formed UTF-8 (RFC 3629) replaced by U+FFFD. What devices
/// and files say goes through this before it goes into a message, whose strings must be UTF-8.
std::string valid_utf8(std::string_view text);

/// The same, without control characters ('?' stands for each), and at most `limit` bytes, cut between
/// characters: fit for an error message or a log, where it must not move a cursor or fill a page.
std::string printable(std::string_view text, std::size_t limit);

}  // namespace nodal
