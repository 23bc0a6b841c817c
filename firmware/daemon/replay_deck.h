// The heads that play files.
#pragma once

#include <filesystem>
#include <memory>

#include "firmware/config/config.h"
#include "hal/clock.h"
#include "hal/replay/deck.h"

namespace nodal::daemon {

/// For all heads of rig.toml on replay: and take: ports. `base`: of relative paths; `buffers`: of each head.
std::unique_ptr<hal::replay::Deck> make_deck(const firmware::RigConfig& config, const std::filesystem::path& base,
                                             hal::ClockPort& clock, int buffers);

}  // namespace nodal::daemon
