#include "draw_request.h"

#include <array>

#include "protocol/framing.h"
#include "tests/fuzz/stand.h"
#include "tests/fuzz/telling.h"

namespace nodal::fuzz {
namespace {

using google::protobuf::MessageLite;

/// Fields that no message has: one large one, or many small ones with all wire types and several numbers.
std::string unknown_fields(std::size_t bytes, unsigned kind) {
  enum WireType : std::uint32_t { kVarint, kFixed64, kLengthDelimited, kGroup, kGroupEnd, kFixed32 };
  constexpr std::array<std::uint32_t, 3> kNumbers = {1999, 536'870'911, 100'000};  // the second is the largest possible
  std::string fields;
  const auto varint = [&](std::uint64_t value) {
    for (; value >= 0x80; value >>= 7) fields.push_back(static_cast<char>((value & 0x7F) | 0x80));
    fields.push_back(static_cast<char>(value));
  };
  const auto key = [&](std::size_t which, WireType type) { varint(kNumbers[which % kNumbers.size()] << 3 | type); };
  const auto text = [&](std::size_t which, std::size_t length) {
    key(which, kLengthDelimited);
    varint(length);
    fields.append(length, 'u');
  };
  if (kind < 4) {
    text(kind, bytes);
    return fields;
  }
  for (std::size_t i = 0; fields.size() < bytes; ++i) {
    switch (kind) {
      case 4: key(i, kVarint), varint(std::uint64_t{1} << i % 64); break;
      case 5: key(i, kFixed64), fields.append(8, 'u'); break;
      case 6: key(i, kGroup), text(i, i % 16), key(i, kGroupEnd); break;
      default: key(i, kFixed32), fields.append(4, 'u'), text(i, i % 16); break;
    }
  }
  return fields;
}

void add_unknown(ByteReader& in, MessageLite& request, MessageLite& inner) {
  constexpr std::size_t kRoom = 400;  // bytes left for the known fields, and for the last unknown one
  constexpr std::array<std::size_t, 8> kSizes = {0, 1, 100, 1000, 2000, 4000, 6000, kMaxMessageBytes - kRoom};
  const unsigned how = in.u8();
  if (how % 2 == 0) return;
  MessageLite& into = how % 4 == 1 ? inner : request;
  NODAL_ASSERT(into.MergeFromString(unknown_fields(kSizes[how / 4 % kSizes.size()], how / 32)));
}

std::string draw_id(ByteReader& in) {
  const unsigned kind = in.u8();
  static const std::array ids{sha256_to_wire(calibration_id(Stand::calibrations()[0])),
                              sha256_to_wire(calibration_id(Stand::calibrations()[1]))};
  const std::string& id = ids[kind / 4 % 2];
  switch (kind % 4) {
    case 0: return {};
    case 1: return id;
    case 2: return id.substr(0, kind / 8);
    default: return text(in);
  }
}

void draw(ByteReader& in, wire::HeadSetRequest& set) {
  const unsigned which = in.u8();
  for (unsigned n = which / 64; n > 0; --n) set.add_heads(telling32(in));
  if (which & 1) set.set_exposure_ns(telling(in));
  if (which & 2) set.set_gain_mdb(static_cast<std::int32_t>(telling32(in)));
  if (which & 4) set.set_red_q12(telling32(in));
  if (which & 8) set.set_blue_q12(telling32(in));
  if (which & 16) set.set_gamma(telling32(in));
  if (which & 32) {  // values that heads accept
    set.set_exposure_ns(10'000 + std::uint64_t{in.u16()} * 100);
    set.clear_heads();
  }
}

void draw(ByteReader& in, wire::GenlockRequest& genlock) {
  const unsigned which = in.u8();
  genlock.set_action(static_cast<wire::GenlockRequest::Action>(which % 4));
  if (which & 4) {
    const DrawnRate rate = drawn_terms(in);
    genlock.set_rate_numerator(rate.numerator);
    genlock.set_rate_denominator(rate.denominator);
  }
  if (which & 16) genlock.set_pulse_width_ns(telling(in));
}

void draw(ByteReader& in, wire::ExposureRequest& exposure) {
  constexpr std::array<const char*, 4> kPrograms = {"manual", "each", "joint", "MANUAL"};
  const unsigned which = in.u8();
  if (which & 1) exposure.set_program(kPrograms[in.u8() % kPrograms.size()]);
  if (which & 2) exposure.set_anchor(static_cast<std::int32_t>(telling32(in)));
  if (which & 4) exposure.set_target_below(telling32(in));
  if (which & 8) exposure.set_difference(telling32(in));
  if (which & 16) exposure.set_ramp(telling32(in));
  if (which & 32) exposure.set_longest_ns(telling(in));
  if (which & 64) exposure.set_highest_gain_mdb(static_cast<std::int32_t>(telling32(in)));
  if (which & 128) exposure.set_locked(in.u8() % 2 == 1);
}

void draw(ByteReader& in, wire::PullRequest& pull) {
  const unsigned which = in.u8();
  pull.set_coding(static_cast<wire::PullRequest::Coding>(which % 4));
  pull.set_lossless((which & 4) != 0);
  if (which & 8) pull.set_count(telling(in));
}

/// Draws the content; returns the inner message, so that unknown fields can be added to it.
MessageLite& draw_inner(ByteReader& in, wire::Request& request) {
  // Requests that change stored settings are as frequent as all others together.
  constexpr std::array<unsigned, 16> kSetting = {2, 3, 4, 2, 3, 4, 2, 3, 4, 2, 3, 4, 2, 16, 17, 18};
  const unsigned kind = in.u8() % 32;
  switch (kind < 16 ? kind : kSetting[kind - 16]) {
    case 0: return *request.mutable_status();
    case 1: return *request.mutable_heads();
    case 2: draw(in, *request.mutable_head_set()); return *request.mutable_head_set();
    case 3: draw(in, *request.mutable_genlock()); return *request.mutable_genlock();
    case 4: draw(in, *request.mutable_exposure()); return *request.mutable_exposure();
    case 5:
      request.mutable_upload_begin()->set_length(telling(in));
      request.mutable_upload_begin()->set_sha256(draw_id(in));
      return *request.mutable_upload_begin();
    case 6:
      request.mutable_upload_commit()->set_sha256(draw_id(in));
      if (in.u8() % 2 == 1) request.mutable_upload_commit()->set_trial_ns(telling(in));
      return *request.mutable_upload_commit();
    case 7: return *request.mutable_calibration_list();
    case 8: request.mutable_calibration_get()->set_id(draw_id(in)); return *request.mutable_calibration_get();
    case 9: request.mutable_calibration_use()->set_id(draw_id(in)); return *request.mutable_calibration_use();
    case 10: return *request.mutable_calibration_rollback();
    case 11:
      request.mutable_trial_end()->set_id(draw_id(in));
      request.mutable_trial_end()->set_keep(in.u8() % 2 == 1);
      return *request.mutable_trial_end();
    case 12: draw(in, *request.mutable_pull()); return *request.mutable_pull();
    case 13: request.mutable_pull_stop()->set_stream(telling32(in)); return *request.mutable_pull_stop();
    case 14: return *request.mutable_frame_set();
    case 15: return *request.mutable_audit_log();
    case 16: return *request.mutable_hosts();
    case 17: request.mutable_host_end()->set_number(telling(in)); return *request.mutable_host_end();
    case 18:
      if (in.u8() % 2 == 1) return *request.mutable_devices();
      return request;
    default: return request;  // an empty request, which this rig does not know
  }
}

}  // namespace

wire::Request draw_request(ByteReader& in) {
  wire::Request request;
  MessageLite& inner = draw_inner(in, request);
  add_unknown(in, request, inner);
  return request;
}

}  // namespace nodal::fuzz
