#include "firmware/record/head_coder.h"

#include "protocol/base/field.h"
#include "stitch/media/jpeg_writer.h"

namespace nodal::firmware {
namespace {

/// The fields of a frame. The top field comes first, whichever was exposed first: FFmpeg takes the first JPEG of a block for the top
/// field, and the file's FieldOrder says which was exposed first.
std::vector<FieldParity> parities_of(Fields fields) {
  switch (fields) {
    case Fields::kProgressive: return {};
    case Fields::kTopFirst:
    case Fields::kBottomFirst: return {FieldParity::kTop, FieldParity::kBottom};
    case Fields::kTopOnly: return {FieldParity::kTop};
    case Fields::kBottomOnly: return {FieldParity::kBottom};
  }
  return {};
}

}  // namespace

HeadCoder::HeadCoder(const HeadStream& delivered) : parities_(parities_of(delivered.fields)) {
  media::JpegSpec spec{.format = delivered.format, .width = delivered.width, .height = delivered.height};
  if (parities_.empty()) fields_[0].writer = std::make_unique<media::JpegWriter>(spec);
  spec.height /= 2;
  for (std::size_t k = 0; k < parities_.size(); ++k) {
    spec.field = parities_[k];
    fields_[k].writer = std::make_unique<media::JpegWriter>(spec);
  }
}

HeadCoder::HeadCoder(HeadCoder&& other) noexcept = default;
HeadCoder::~HeadCoder() = default;

bool HeadCoder::codes(const HeadStream& delivered) {
  if (!media::JpegWriter::writes(delivered.format)) return false;
  if (delivered.fields == Fields::kProgressive) return true;
  // Both fields must have the same rows, of chroma, too.
  const bool halved = delivered.format == PixelFormat::kI420 || delivered.format == PixelFormat::kNv12;
  return delivered.height % (halved ? 4 : 2) == 0;
}

Result<HeadCoder::Parts> HeadCoder::encode(const ImageView& picture, int quality) {
  Parts parts;
  for (std::size_t k = 0; k < fields_.size(); ++k) {
    Field& field = fields_[k];
    if (!field.writer) continue;
    field.writer->set_quality(quality);
    const ImageView rows = parities_.empty() ? picture : field_of(picture, parities_[k]);
    if (const Status written = field.writer->write(rows, "", field.bytes); !written) return fail(written.error());
    parts[k] = field.bytes;
  }
  return parts;
}

}  // namespace nodal::firmware
