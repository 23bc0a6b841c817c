// What the page shows as a film: a Matroska file, the raymaps of a take, or one picture.
#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "host_tool/input/matroska_film.h"
#include "protocol/base/result.h"

namespace nodal::host::look {

/// Whether it is a film or the folder of a take.
bool is_film(const std::string& path);
/// Errors: also kUnsupported for pictures that are no JPEGs, kNotFound for a take without raymaps, and those of
/// media::TakeFolder.
Result<std::unique_ptr<Film>> open_film(const std::string& path);

/// One picture of a layout.
std::unique_ptr<Film> film_of(std::vector<std::uint8_t> jpeg, const std::string& layout);
/// The raymaps of a take on this computer; its folder must stay.
Result<std::unique_ptr<Film>> open_take_raymaps(const std::string& folder);

}  // namespace nodal::host::look
