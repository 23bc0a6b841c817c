#include "protocol/wire_error.h"

#include <algorithm>

#include "protocol/base/text.h"

namespace nodal {
namespace {

constexpr std::size_t kLongestMessage = 1000;

}  // namespace

wire::Error to_wire(const Error& error) {
  wire::Error message;
  message.set_code(static_cast<std::uint32_t>(error.code));
  message.set_message(printable(error.message, kLongestMessage));
  return message;
}

Error from_wire(const wire::Error& message) {
  const std::uint32_t code = std::min<std::uint32_t>(message.code(), UINT16_MAX);
  return Error{static_cast<Errc>(code), printable(message.message(), kLongestMessage)};
}

}  // namespace nodal
