// A small rig with a flight recorder, for tests of it.
#pragma once

#include <gtest/gtest.h>

#include <functional>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "firmware/config/config.h"
#include "flight_player.h"
#include "flight_reader.h"
#include "tests/scenario/stand.h"

namespace nodal::flight {

using scenario::Stand;
using scenario::StandOptions;
using scenario::TestHost;
using Bytes = std::vector<std::uint8_t>;

inline firmware::RigConfig flying_config() {
  std::string text =
      "[rig]\nname = \"small\"\n[raymap]\nwidth = 128\nheight = 64\nformat = \"RGB24\"\n[links]\nunix = \"sock\"\n"
      "[sim]\ncalibration = \"truth.json\"\n"
      "[takes]\nfolder = \"takes\"\nbuffer_mb = 16\nflight_recorder = true\n";
  for (int i = 0; i < scenario::kHeads; ++i) {
    const std::string name = "cam" + std::to_string(i);
    text += "[[heads]]\nname = \"" + name + "\"\nport = \"sim:" + name + "\"\nformat = \"RGB24\"\n";
  }
  auto config = firmware::parse_rig_config(text, "rig.toml");
  NODAL_ASSERT(config);
  config->text = std::make_shared<const std::string>(std::move(text));
  return *config;
}

inline StandOptions flying_rig() {
  StandOptions options;
  options.config = flying_config();
  return options;
}

inline wire::Reply ask(TestHost& host, const std::function<void(wire::Request&)>& fill) {
  wire::Request request;
  fill(request);
  return host.ask(request);
}
inline void start_take(TestHost& host) {
  const wire::Reply reply = ask(host, [](wire::Request& request) { request.mutable_take_start(); });
  EXPECT_TRUE(reply.has_take()) << reply.error().message();
}
inline void stop_take(TestHost& host) {
  const wire::Reply reply = ask(host, [](wire::Request& request) { request.mutable_take_stop(); });
  EXPECT_TRUE(reply.has_take()) << reply.error().message();
}

struct Played {
  Result<std::optional<Difference>> result;
  std::uint64_t steps = 0;
  std::string ended;
};
inline Played play(std::span<const std::uint8_t> bytes) {
  auto reader = FlightReader::open(bytes, "flight");
  if (!reader) return {fail(reader.error()), 0, ""};
  FlightPlayer player(flying_config(), *reader);
  auto result = player.play();
  return {std::move(result), player.steps(), reader->ended()};
}

}  // namespace nodal::flight
