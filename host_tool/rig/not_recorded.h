#pragma once

#include <string>

#include "host_tool/console/console.h"
#include "protocol/base/text.h"
#include "protocol/nodal.pb.h"

namespace nodal::host {

/// Warns when a change was made and is not in the audit log on the rig's disk.
inline void note_not_recorded(Console& console, const wire::Reply& reply) {
  constexpr std::size_t kMaxReason = 500;  // bytes
  const std::string reason = printable(reply.not_recorded(), kMaxReason);
  if (!reason.empty()) console.note("nodal: done, but not in the audit log on the rig's disk: " + reason);
}

}  // namespace nodal::host
