// Values of headers that browsers send: cookies, ranges of bytes, bearer tokens. Whatever is malformed is as if absent.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>

namespace nodal::host::web {

/// 256 random bits that name a device, as 64 lower-case hexadecimal digits.
inline constexpr std::size_t kSecretDigits = 64;
/// Whether the text has so many lower-case hexadecimal digits and nothing else.
bool is_hex(std::string_view text, std::size_t digits);

/// Longest Cookie header that is read: other pages of the same name may have cookies, too.
inline constexpr std::size_t kMaxCookieBytes = 8192;
/// The secret in the cookie `name` of a Cookie header (RFC 6265, 4.2.1). Nothing if the header is too long, has no such
/// cookie, has it twice, or its value has not the length and the
/// digits of a secret.
std::optional<std::string> secret_of_cookie(std::string_view header, std::string_view name);

/// The secret of "Bearer SECRET" (RFC 6750, 2.1).
std::optional<std::string> secret_of_bearer(std::string_view header);

/// Bytes of a file: `length` from `begin` on, within the file.
struct ByteRange {
  std::uint64_t begin = 0;
  std::uint64_t length = 0;
  friend bool operator==(const ByteRange&, const ByteRange&) = default;
};
enum class RangeKind : std::uint8_t {
  kWhole,    ///< no range, or one that a server may ignore: the whole file
  kPart,     ///< `range`
  kOutside,  ///< nothing of the file is in it: 416
};
struct ParsedRange {
  RangeKind kind = RangeKind::kWhole;
  ByteRange range{};
};
/// A Range header for a file of `size` bytes (RFC 9110, 14.1 and 14.2). Several ranges are ignored.
ParsedRange parse_range(std::string_view header, std::uint64_t size);

}  // namespace nodal::host::web
