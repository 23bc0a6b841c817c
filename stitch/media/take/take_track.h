// A stored stream as a track of a Matroska file.
#pragma once

#include "protocol/take/matroska_writer.h"
#include "protocol/take/stream.h"

namespace nodal::media {

/// What the stream says of its track: codec, size, colours, order of the fields. The rest is left as it is made.
take::VideoTrack track_of(const take::Stream& stream);

}  // namespace nodal::media
