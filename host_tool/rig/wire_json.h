// The rig's answers as JSON for programs. Every key contains its unit; keys are only ever added.
#pragma once

#include <string>

#include "host_tool/console/console.h"
#include "protocol/nodal.pb.h"

namespace nodal::host {

std::string hex_of(const std::string& bytes);

Json to_json(const wire::RigStatus& status, const std::string& rig_name, const std::string& address);
Json to_json(const wire::HeadState& head);
Json to_json(const wire::Heads& heads);
Json to_json(const wire::Genlock& genlock);
Json to_json(const wire::ExposureState& exposure);
Json to_json(const wire::CalibrationEntry& entry);

}  // namespace nodal::host
