// What a segment must say beyond what read_evidence() checks, for everybody who reads a take, and for the recovery that
// writes one.
#pragma once

#include <cstdint>
#include <optional>
#include <string>

#include "protocol/base/field.h"
#include "protocol/base/image.h"
#include "protocol/base/result.h"
#include "protocol/take/documents.h"
#include "protocol/take/evidence.h"

namespace nodal::media {

/// The pictures of one file.
struct TakeStream {
  std::string file;                   ///< its name in the folder
  std::optional<std::uint32_t> head;  ///< nothing: raymaps
  PixelFormat format = PixelFormat::kMjpeg;
  int width = 0;  ///< px
  int height = 0;
  ColourCoding coding;
  Fields fields = Fields::kProgressive;
  bool lossless = false;      ///< the file's frames are Ut Video, and `format` is that of the decoded pictures
  bool fields_apart = false;  ///< a frame is two JPEGs, one of each field, the one exposed first is first
};
TakeStream stream_of(const take::wire::File& file);

/// How many sets of a take come before a segment.
struct SetsBefore {
  std::uint64_t kept = 0;     ///< sets in the segments before it
  std::uint64_t deleted = 0;  ///< sets that were deleted to make room for newer ones
};

/// Whether the segment, by its name number `number`, may come after the others, and whether its pictures have the sizes
/// of their formats and belong to heads of the take. Errors: kBadFormat, kTooLarge.
Status check_segment(const take::Segment& segment, std::uint32_t number, const take::TakeDocument& about,
                     SetsBefore before);

}  // namespace nodal::media
