#include "protocol/take/stream.h"

#include "protocol/take/evidence.pb.h"

namespace nodal::take {

StreamFile stream_file(const wire::File& record) {
  StreamFile file;
  file.name = record.name();
  if (record.has_head()) file.head = record.head();
  file.stream.format = pixel_format_named(record.format()).value_or(PixelFormat::kMjpeg);
  file.stream.width = static_cast<int>(record.width());
  file.stream.height = static_cast<int>(record.height());
  file.stream.coding = {.video_range = record.video_range(), .bt709 = record.bt709()};
  file.stream.fields = fields_named(record.fields()).value_or(Fields::kProgressive);
  file.stream.lossless = record.lossless();
  file.fields_apart = record.fields_apart();
  return file;
}

void write_stream_file(const StreamFile& file, wire::File& record) {
  record.set_name(file.name);
  if (file.head) record.set_head(*file.head);
  record.set_format(std::string(pixel_format_name(file.stream.format)));
  record.set_width(static_cast<std::uint32_t>(file.stream.width));
  record.set_height(static_cast<std::uint32_t>(file.stream.height));
  record.set_video_range(file.stream.coding.video_range);
  record.set_bt709(file.stream.coding.bt709);
  record.set_fields(std::string(fields_name(file.stream.fields)));
  record.set_lossless(file.stream.lossless);
  record.set_fields_apart(file.fields_apart);
}

}  // namespace nodal::take
