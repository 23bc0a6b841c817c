// How a segment's files hold a head's pictures.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "firmware/record/take_row.h"
#include "protocol/base/result.h"

namespace nodal::firmware {

/// Whether a head's JPEGs are fields, one after the other in the order of their exposure. Those that the rig coded are;
/// what a camera delivers is looked at, in the segment's first row.
bool fields_apart(const take::Stream& stream, const TakeRow& first, std::size_t head);

/// What stands for a picture that is not there. Errors: kInternal with TurboJPEG's message.
Result<std::vector<std::uint8_t>> grey_picture(const take::Stream& stream);

}  // namespace nodal::firmware
