// The pictures of one file of a take: what its evidence, its Matroska track and its readers must know.
#pragma once

#include <cstdint>
#include <optional>
#include <string>

#include "protocol/base/field.h"
#include "protocol/base/image.h"

namespace nodal::take {

namespace wire {
class File;
}

/// The pictures of a head, or raymaps, as they are stored.
struct Stream {
  PixelFormat format = PixelFormat::kMjpeg;
  int width = 0;   ///< px
  int height = 0;  ///< px
  ColourCoding coding;
  Fields fields = Fields::kProgressive;
  bool lossless = false;  ///< frames are Ut Video, which decodes to `format`
  friend bool operator==(const Stream&, const Stream&) = default;
};

/// A file of a segment.
struct StreamFile {
  std::string name;                   ///< its name in the folder
  std::optional<std::uint32_t> head;  ///< empty: raymaps
  Stream stream;
  bool fields_apart = false;  ///< a frame is two JPEGs, one of each field, the one exposed first is first
};

/// What the evidence says of a file; read_evidence() has checked it.
StreamFile stream_file(const wire::File& file);
/// Fills the record, but for the length of the file's head.
void write_stream_file(const StreamFile& file, wire::File& record);

}  // namespace nodal::take
