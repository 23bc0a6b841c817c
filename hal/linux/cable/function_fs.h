// FunctionFS: a USB function whose endpoints are files.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "hal/linux/cable/function.h"
#include "protocol/base/result.h"

namespace nodal::hal::cable {

/// Opens the function of a FunctionFS folder: writes the descriptors, after which the gadget can be bound.
/// Errors: kNotFound, kBusy, kIo.
Result<std::unique_ptr<UsbFunction>> open_function(const std::string& folder, const std::string& rig);

/// What is written to ep0: the interface and its endpoints at full, high and super speed; the interface's name.
std::vector<std::uint8_t> function_descriptors();
std::vector<std::uint8_t> function_strings(const std::string& rig);

}  // namespace nodal::hal::cable
