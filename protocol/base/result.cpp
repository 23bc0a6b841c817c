#include "protocol/base/result.h"

#include <fmt/format.h>

#include <cstdio>
#include <exception>

namespace nodal {

std::string_view errc_name(Errc code) {
  switch (code) {
    case Errc::kBadFormat: return "bad-format";
    case Errc::kTruncated: return "truncated";
    case Errc::kChecksum: return "checksum";
    case Errc::kBadValue: return "bad-value";
    case Errc::kMissingField: return "missing-field";
    case Errc::kUnknownField: return "unknown-field";
    case Errc::kFutureVersion: return "future-version";
    case Errc::kTooLarge: return "too-large";
    case Errc::kUnsupported: return "unsupported";
    case Errc::kNotARotation: return "not-a-rotation";
    case Errc::kLensDomain: return "lens-domain";
    case Errc::kNoCoverage: return "no-coverage";
    case Errc::kTableInvalid: return "table-invalid";
    case Errc::kHeadMismatch: return "head-mismatch";
    case Errc::kNotDetermined: return "not-determined";
    case Errc::kProtocol: return "protocol";
    case Errc::kVersionMismatch: return "version-mismatch";
    case Errc::kLinkClosed: return "link-closed";
    case Errc::kTimeout: return "timeout";
    case Errc::kBusy: return "busy";
    case Errc::kUnreachable: return "unreachable";
    case Errc::kDeviceGone: return "device-gone";
    case Errc::kDeviceFailed: return "device-failed";
    case Errc::kNoSuchDevice: return "no-such-device";
    case Errc::kBandwidth: return "bandwidth";
    case Errc::kNoSignal: return "no-signal";
    case Errc::kNotFound: return "not-found";
    case Errc::kDiskFull: return "disk-full";
    case Errc::kIo: return "io";
    case Errc::kExists: return "exists";
    case Errc::kWrongState: return "wrong-state";
    case Errc::kNotReady: return "not-ready";
    case Errc::kOverload: return "overload";
    case Errc::kCancelled: return "cancelled";
    case Errc::kInternal: return "internal";
  }
  return "unknown";  // a number from a newer peer
}

std::string Error::text() const {
  return fmt::format("{} ({}): {}", errc_name(code), static_cast<unsigned>(code), message);
}

Error Error::in(std::string_view where) const& { return Error{code, std::string(where) + ": " + message}; }

void assertion_failed(const char* condition, const char* file, int line) {
  std::fprintf(stderr, "%s:%d: this must hold and does not: %s\n", file, line, condition);
  std::terminate();  // aborts; nodald's handler first sets outputs to their safe levels
}

}  // namespace nodal
