// Capture's events as sentences.
#pragma once

#include <string>

#include "firmware/capture/capture_log.h"
#include "firmware/config/config.h"

namespace nodal::flight {

/// "head cam3", "trigger", "genlock", "hosts", ...: where an event comes from.
std::string place_of(const firmware::CaptureEvent& event, const firmware::RigConfig& config);
/// "set 57 closes: heads 0 1 2, pulse 33, locked, ...".
std::string text_of(const firmware::CaptureEvent& event);

}  // namespace nodal::flight
