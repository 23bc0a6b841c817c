#include "protocol/signed_for.h"

#include <fmt/format.h>

#include <charconv>

#include "protocol/base/text.h"
#include "protocol/ssh_signature.h"

namespace nodal {

std::string namespace_of(const SignedFor& what) {
  return fmt::format("{}:{}:{}", kCalibrationNamespace, what.rig, what.generation);
}

Result<SignedFor> parse_namespace(std::string_view name_space) {
  const auto bad = [&] {
    return fail(Errc::kBadValue, "the signature's namespace '" + printable(name_space, 100) + "' is not '" +
                                     std::string(kCalibrationNamespace) + ":RIG:GENERATION'");
  };
  const std::string prefix = std::string(kCalibrationNamespace) + ":";
  const std::size_t colon = name_space.rfind(':');
  if (!name_space.starts_with(prefix) || colon < prefix.size()) return bad();
  SignedFor what{std::string(name_space.substr(prefix.size(), colon - prefix.size())), 0};
  const std::string_view number = name_space.substr(colon + 1);
  const auto [end, error] = std::from_chars(number.data(), number.data() + number.size(), what.generation);
  if (error != std::errc() || end != number.data() + number.size() || what.generation == 0) return bad();
  if (namespace_of(what) != name_space) return bad();
  return what;
}

}  // namespace nodal
