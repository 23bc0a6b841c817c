// What a take says before its first set, and the size of its sets.
#pragma once

#include <cstdint>
#include <optional>
#include <string>

#include "firmware/config/config.h"
#include "firmware/record/take_messages.h"
#include "firmware/record/take_writer.h"
#include "protocol/base/result.h"

namespace nodal::firmware {

/// What the configuration and the request say; without the take's number, software, start and rate.
TakeWriter::Documents documents_of(const RigConfig& config, const TakeRequest::Start& start);

/// Errors: kTooLarge, naming the head whose pictures are larger than a reader of takes accepts.
Status check_pictures(const RigConfig& config, const HeadShapes& heads);

/// Bytes of a set in this mode, or, without a mode, in each head's own one. Lossless counts as raw, because noise may
/// leave nothing for Ut Video to save.
std::uint64_t set_bytes(const RigConfig& config, const HeadShapes& heads, std::optional<TakeMode> mode = std::nullopt);

}  // namespace nodal::firmware
