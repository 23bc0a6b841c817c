// What a paired device may do to the rig: the page's words as requests of the protocol.
#pragma once

#include <string>
#include <string_view>

#include "protocol/base/result.h"
#include "protocol/nodal.pb.h"

namespace nodal::host::web {

/// The request that `POST api/NAME` with this JSON means:
///   record   {"on": true}                    begins a take, or ends it
///   still    {}                              a take of one set
///   mark     {"text": "the door opens"}
///   protect  {"take": 3, "on": true}
///   genlock  {"on": true}
///   exposure {"program": "joint", "locked": false, "anchor": 0, "longest_ns": 1, "highest_gain_mdb": 0}; some of these
///   heads    {"heads": [0, 2], "exposure_ns": 1, "gain_mdb": 0}; no heads: all
/// Errors: kNotFound for another name; kBadFormat, kBadValue for the JSON.
Result<wire::Request> operation(std::string_view name, std::string_view json);

inline constexpr std::size_t kMaxOperationBytes = 4096;

}  // namespace nodal::host::web
