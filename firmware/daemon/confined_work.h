// Work on data that nobody vouches for, in processes without rights.
#pragma once

#include <filesystem>
#include <memory>
#include <string>

#include "firmware/config/config.h"
#include "hal/confined.h"
#include "protocol/base/result.h"

namespace nodal::daemon {

/// Recovers takes of this folder: the process may read and write the folder of the one take, and nothing else. Call it
/// before nodald opens devices and sockets. Errors: kOverload if the system refuses a process.
Result<std::unique_ptr<hal::ConfinedPort>> start_recovery(const std::filesystem::path& takes);

/// Parses and compiles uploaded calibrations first: the process may read and write no file. Call it as
/// start_recovery().
Result<std::unique_ptr<hal::ConfinedPort>> start_rehearsal(const firmware::RigConfig& config);

/// A sentence about what this kernel lacks for it; empty: nothing.
std::string missing_confinement();

}  // namespace nodal::daemon
