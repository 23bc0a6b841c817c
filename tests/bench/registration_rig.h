// Rigs similar to the reference set's, rendered by the simulator with other seeds.
#pragma once

#include <cstdint>
#include <filesystem>

namespace nodal::bench {

/// Ten 720x480 heads with slightly different lenses like the one in the paper's Figure 3, over the whole sphere; gains
/// of +-15 %, fall-off, noise. Writes the heads' pictures, rig_gt.json and the true sphere, in the reference set's
/// format. Exits with one line if a file cannot be written.
void render_set(const std::filesystem::path& folder, std::uint64_t seed);

}  // namespace nodal::bench
