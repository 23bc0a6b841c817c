// A card of a stranger: takes whose files claim or hold the most that they can, so that reading them needs most memory.
#pragma once

#include <cstdint>
#include <filesystem>

namespace nodal::test {

/// 1: 65 kB of evidence that claim one row of 3.9 GiB, with a sparse file to match.
/// 2: a manifest of 31 MiB of empty objects.
/// 3: 64 MiB of evidence of raymaps, 1.8 GiB when they are all kept.
/// 4: evidence of as many sets of 16 heads as a segment may have.
/// Only the second has a manifest; a rig recovers the others when it starts.
inline constexpr std::uint64_t kForeignTakes = 4;

/// Writes them into the folder of takes.
void put_foreign_takes(const std::filesystem::path& takes);

}  // namespace nodal::test
