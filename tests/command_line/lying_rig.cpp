#include "lying_rig.h"

#include <gtest/gtest.h>

#include <array>

#include "protocol/base/bytes.h"
#include "protocol/session.h"

namespace nodal::command_line {
namespace {

std::span<const std::uint8_t> bytes_of(const std::string& text) {
  return {reinterpret_cast<const std::uint8_t*>(text.data()), text.size()};
}

void append(std::string& to, std::uint64_t value, int bytes) {
  for (int i = 0; i < bytes; ++i) to.push_back(static_cast<char>(value >> (8 * i) & 0xFF));
}

}  // namespace

LyingRig::LyingRig(const std::string& socket) : hello(make_hello("liar")) {
  Result<std::unique_ptr<hal::LinkListenerPort>> listener = hal::listen_link("unix:" + socket);
  EXPECT_TRUE(listener) << listener.error().text();
  if (listener) listener_ = std::move(*listener);
}

void LyingRig::reply_rate(const wire::Request& request) {
  wire::Reply rate;
  rate.mutable_genlock()->set_rate_numerator(30);
  rate.mutable_genlock()->set_rate_denominator(1);
  reply(request, std::move(rate));
}

void LyingRig::greet() {
  decoder_ = std::make_unique<FrameDecoder>();
  sequence_ = 0;
  out_.clear();
  frame(FrameType::kHello, 0, hello.SerializeAsString());
}

void LyingRig::step() {
  if (Result<std::unique_ptr<hal::LinkPort>> link = listener_->accept(); link && *link) {
    link_ = std::move(*link);
    greet();
  }
  if (!link_) return;
  std::array<std::uint8_t, 65536> buffer;
  const Result<std::size_t> got = link_->read(buffer);
  if (!got) {
    link_.reset();
    return;
  }
  std::span<const std::uint8_t> bytes(buffer.data(), *got);
  for (auto next = decoder_->next(bytes); next && *next; next = decoder_->next(bytes)) {
    wire::Request request;
    if ((*next)->header.type != FrameType::kRequest) continue;
    ASSERT_TRUE(request.ParseFromArray((*next)->payload.data(), static_cast<int>((*next)->payload.size())));
    on(request);
  }
  const Result<std::size_t> taken = link_->write(out_);
  if (taken) out_.erase(out_.begin(), out_.begin() + static_cast<std::ptrdiff_t>(*taken));
}

void LyingRig::frame(FrameType type, StreamId stream, const std::string& payload) {
  const auto header = encode_frame_header(FrameHeader{type, 0, stream, sequence_++}, bytes_of(payload));
  out_.insert(out_.end(), header.begin(), header.end());
  out_.insert(out_.end(), payload.begin(), payload.end());
}

void LyingRig::reply(const wire::Request& request, wire::Reply reply) {
  reply.set_id(request.id());
  frame(FrameType::kReply, 0, reply.SerializeAsString());
}

void LyingRig::open_stream(StreamId stream, StreamPolicy policy) {
  wire::StreamOpen open;
  open.set_policy(static_cast<std::uint32_t>(policy));
  frame(FrameType::kStreamOpen, stream, open.SerializeAsString());
}

void LyingRig::first_piece(StreamId stream, std::uint64_t item, const std::string& meta, std::uint64_t total,
                           const std::string& body) {
  std::string payload;
  append(payload, item, 8);
  append(payload, meta.size() + total, 8);
  append(payload, 0, 8);
  append(payload, meta.size(), 4);
  frame(FrameType::kBulk, stream, payload + meta + body);
}

std::string raymap_meta(std::uint32_t width, std::uint32_t height, const std::string& coding) {
  wire::RaymapHeader header;
  header.set_width(width);
  header.set_height(height);
  header.set_coding(coding);
  return header.SerializeAsString();
}

}  // namespace nodal::command_line
