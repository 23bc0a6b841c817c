// The files of a take that is on a rig's disk, as the reader of takes (`stitch/media/take`) needs them.
#pragma once

#include <cstdint>
#include <memory>

#include "host_tool/rig/rig_connection.h"
#include "stitch/media/take/take_files.h"

namespace nodal::host {

/// Documents and evidence are fetched whole when they are opened, video in windows of 8 MiB, when it is read. For a
/// take of more than some seconds a copy (TakeCopy) is faster.
///
/// Threading: thread-bound.
/// Ownership: owns the connection.
/// Errors: those of fetch_file().
std::shared_ptr<media::TakeFiles> rig_take_files(std::unique_ptr<RigConnection> rig, std::uint64_t take);

}  // namespace nodal::host
