// Errors are values: every fallible call returns a Result, and every error has a number that scripts,
// logs and the wire share. Numbers are in ranges by meaning and are never renumbered.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <tl/expected.hpp>
#include <utility>

namespace nodal {

/// The kind of error. The hundreds give the area; the number is used on the wire and for exit codes.
enum class Errc : std::uint16_t {
  // 1xx: the input cannot be understood
  kBadFormat = 100,      ///< another kind of file or message than expected
  kTruncated = 101,      ///< ends too early
  kChecksum = 102,       ///< a CRC or SHA-256 does not match
  kBadValue = 103,       ///< a field's value is outside what is allowed
  kMissingField = 104,   ///< a required field is missing
  kUnknownField = 105,   ///< a field that this version does not know, usually a typing error
  kFutureVersion = 106,  ///< written by a newer Nodal than this one
  kTooLarge = 107,       ///< over a stated limit
  kUnsupported = 108,    ///< understood, but not something Nodal does
  // 2xx: the calibration or the table made from it is wrong
  kNotARotation = 200,   ///< a matrix that is a reflection, sheared, or not orthonormal
  kLensDomain = 201,     ///< a lens used past its turning point, or that does not cover its image
  kNoCoverage = 202,     ///< no head sees the requested directions
  kTableInvalid = 203,   ///< a blend table that fails validation
  kHeadMismatch = 204,   ///< the calibration's heads differ from the rig's
  kNotDetermined = 205,  ///< the pictures do not determine the requested quantity
  // 3xx: the link
  kProtocol = 300,         ///< the peer broke the rules of framing or order
  kVersionMismatch = 301,  ///< no protocol version in common
  kLinkClosed = 302,       ///< the peer closed the link or ended
  kTimeout = 303,          ///< no answer in time
  kBusy = 304,             ///< another client is doing this
  kUnreachable = 305,      ///< no rig answers at that address
  // 4xx: devices
  kDeviceGone = 400,    ///< unplugged; final for the object that reports it
  kDeviceFailed = 401,  ///< present, but does not work as specified
  kNoSuchDevice = 402,  ///< no such device was ever found
  kBandwidth = 403,     ///< the bus cannot carry the requested data rate
  kNoSignal = 404,      ///< present, but its input has no picture
  // 5xx: storage
  kNotFound = 500,
  kDiskFull = 501,
  kIo = 502,
  kExists = 503,
  // 6xx: a valid request at the wrong moment
  kWrongState = 600,
  kNotReady = 601,
  kOverload = 602,
  kCancelled = 603,
  // 9xx: Nodal itself
  kInternal = 900,
};

/// The number's name, as printed and searched for, such as "not-a-rotation".
std::string_view errc_name(Errc code);

/// One clear sentence that names the file, field or head and says how to correct the problem.
struct Error {
  Errc code = Errc::kInternal;
  std::string message;

  /// The text for users: "not-a-rotation (200): head 'cam3': ...".
  std::string text() const;
  /// The same error with its place prepended: "rig.toml: " + message.
  Error in(std::string_view where) const&;
};

template <class T>
using Result = tl::expected<T, Error>;
using Status = Result<void>;

inline tl::unexpected<Error> fail(Errc code, std::string message) {
  return tl::make_unexpected(Error{code, std::move(message)});
}
inline tl::unexpected<Error> fail(Error error) { return tl::make_unexpected(std::move(error)); }

/// Ends the program at a programming error, in every build. Never for invalid input.
[[noreturn]] void assertion_failed(const char* condition, const char* file, int line);

}  // namespace nodal

#define NODAL_ASSERT(condition) \
  ((condition) ? static_cast<void>(0) : ::nodal::assertion_failed(#condition, __FILE__, __LINE__))
