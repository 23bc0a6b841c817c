// A take in a folder of this computer.
#pragma once

#include <filesystem>
#include <memory>

#include "stitch/media/take/take_files.h"

namespace nodal::host {

std::shared_ptr<media::TakeFiles> take_files(const std::filesystem::path& folder);

}  // namespace nodal::host
