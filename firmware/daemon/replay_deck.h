// The heads that play files.
#pragma once

#include <filesystem>
#include <memory>

#include "firmware/config/config.h"
#include "hal/clock.h"
#include "hal/replay/deck.h"

namespace nodal::daemon {

/// Makes the deck of all heads of rig.toml on replay: and take: ports. `base`: the folder that relative paths begin at;
/// `buffers`: how many each head has.
std::unique_ptr<hal::replay::Deck> make_deck(const firmware::RigConfig& config, const std::filesystem::path& base,
                                             hal::ClockPort& clock, int buffers);

}  // namespace nodal::daemon
