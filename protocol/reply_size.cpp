#include "protocol/reply_size.h"

#include <fmt/format.h>

#include <google/protobuf/io/coded_stream.h>
#include <google/protobuf/wire_format_lite.h>

#include <string>

#include "protocol/framing.h"
#include "protocol/nodal.pb.h"

namespace nodal {

Status check_reply_size(std::span<const std::uint8_t> payload) {
  if (payload.size() <= kMaxListReplyBytes) return {};
  using google::protobuf::internal::WireFormatLite;
  google::protobuf::io::CodedInputStream in(payload.data(), static_cast<int>(payload.size()));
  std::size_t lists = 0;
  while (const std::uint32_t tag = in.ReadTag()) {
    const int begin = in.CurrentPosition();
    if (!WireFormatLite::SkipField(&in, tag)) {
      return fail(Errc::kProtocol, "what a reply frame holds cannot be read as one");
    }
    const int field = WireFormatLite::GetTagFieldNumber(tag);
    if (field != wire::Reply::kCalibrationFieldNumber) lists += static_cast<std::size_t>(in.CurrentPosition() - begin);
  }
  if (lists <= kMaxListReplyBytes) return {};
  return fail(Errc::kTooLarge, fmt::format("a reply of {} bytes that is not a calibration; at most {} are taken",
                                           payload.size(), kMaxListReplyBytes));
}

}  // namespace nodal
