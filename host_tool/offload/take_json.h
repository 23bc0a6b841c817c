// A take of a rig's list as JSON for programs. Every key contains its unit; keys are only ever added.
#pragma once

#include "host_tool/console/console.h"
#include "protocol/nodal.pb.h"

namespace nodal::host {

Json to_json(const wire::TakeEntry& take);

}  // namespace nodal::host
