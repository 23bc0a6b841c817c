// What a calibration is signed for: one rig, and a generation that counts its signed calibrations. Both are in the
// namespace of the signature (ssh-keygen's -n), so the key signs them with the document.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>

#include "protocol/base/result.h"

namespace nodal {

struct SignedFor {
  std::string rig;               ///< [rig] name of its rig.toml
  std::uint64_t generation = 0;  ///< 1 or more
  friend bool operator==(const SignedFor&, const SignedFor&) = default;
};

/// "nodal-calibration:bridge:7".
std::string namespace_of(const SignedFor& what);

/// Errors: kBadValue for anything else, also with zeros before the number.
Result<SignedFor> parse_namespace(std::string_view name_space);

}  // namespace nodal
