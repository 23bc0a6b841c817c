// Takes as heads: the frames of one head of a take, for hal/replay.
#pragma once

#include <memory>
#include <string>

#include "hal/disk.h"
#include "hal/replay/reel.h"
#include "protocol/base/result.h"

namespace nodal::firmware {

/// The frames of a head, one for each set, with the settings that were in effect. Sets in which the head is missing
/// have none. The take is in `folder` of the disk ("": it is the disk's own folder), which `shown` names in messages. A
/// frame whose bytes differ from what was recorded is without a picture.
/// Errors: those of media::TakeFolder; kNoSuchDevice if the take has no head of that name, or no picture of it.
Result<std::unique_ptr<hal::replay::Reel>> open_take_reel(std::unique_ptr<hal::DiskPort> disk,
                                                          const std::string& folder, const std::string& shown,
                                                          const std::string& head);

}  // namespace nodal::firmware
