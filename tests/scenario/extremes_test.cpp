// All numbers that hosts and rig.toml may set, at the limits of their ranges: the rig runs, a day passes at once, and
// it continues. Sanitizers detect overflow (preset asan); values beyond the limits are refused with the range.
#include <gtest/gtest.h>

#include "tests/scenario/stand.h"

namespace nodal::scenario {
namespace {

using Make = void (*)(wire::Request&);

struct Extreme {
  const char* name;
  Make make;
  friend std::ostream& operator<<(std::ostream& out, const Extreme& extreme) { return out << extreme.name; }
};

wire::Request made_by(const Extreme& extreme) {
  wire::Request request;
  extreme.make(request);
  return request;
}

void start_genlock(wire::Request& request, std::uint32_t numerator, std::uint32_t denominator,
                   std::uint64_t pulse = 0) {
  request.mutable_genlock()->set_action(wire::GenlockRequest::START);
  request.mutable_genlock()->set_rate_numerator(numerator);
  request.mutable_genlock()->set_rate_denominator(denominator);
  request.mutable_genlock()->set_pulse_width_ns(pulse);
}

void white_balance(wire::Request& request, std::uint32_t red, std::uint32_t blue) {
  request.mutable_head_set()->set_red_q12(red);
  request.mutable_head_set()->set_blue_q12(blue);
}

/// Checks that the rig runs on: for two seconds, after a jump of a day without steps, and for two more seconds.
void expect_that_it_runs_on(Stand& stand) {
  stand.run(Duration::seconds(2));
  EXPECT_NE(stand.state(), "hanging");
  stand.world.clock().advance(Duration::seconds(86'400));
  const std::uint64_t sets = stand.capture().sets;
  stand.run(Duration::seconds(2));
  EXPECT_NE(stand.state(), "hanging");
  if (stand.capture().genlock.rate.period() < Duration::milliseconds(500)) {
    EXPECT_GT(stand.capture().sets, sets);
  }
}

class AcceptedRequest : public testing::TestWithParam<Extreme> {};

TEST_P(AcceptedRequest, AtTheEndOfItsRange_TheRigRunsOnOverADay) {
  Stand stand;
  TestHost& host = stand.bring_up();
  stand.lock(host);
  const wire::Reply reply = host.ask(made_by(GetParam()));
  // A head's own range may be narrower; then the request is refused and changes nothing.
  EXPECT_TRUE(!reply.has_error() || reply.error().code() == static_cast<unsigned>(Errc::kBadValue))
      << reply.error().message();
  expect_that_it_runs_on(stand);
}

/// The range of a disconnected head is unknown: the request is accepted, and applied when the head returns.
TEST_P(AcceptedRequest, WhileHeadsAreAway_TheRigRunsOnWhenTheyReturn) {
  Stand stand;
  TestHost& host = stand.bring_up();
  stand.lock(host);
  for (int i = 0; i < kHeads; ++i) stand.world.head(i).unplug();
  stand.run(Duration::milliseconds(500));
  const wire::Reply reply = host.ask(made_by(GetParam()));
  EXPECT_FALSE(reply.has_error()) << reply.error().message();
  for (int i = 0; i < kHeads; ++i) stand.world.head(i).replug();
  expect_that_it_runs_on(stand);
}

INSTANTIATE_TEST_SUITE_P(
    Requests, AcceptedRequest,
    testing::Values(
        Extreme{"exposure_1ns", [](wire::Request& r) { r.mutable_head_set()->set_exposure_ns(1); }},
        Extreme{"exposure_1h", [](wire::Request& r) { r.mutable_head_set()->set_exposure_ns(3'600'000'000'000); }},
        Extreme{"gain_lowest", [](wire::Request& r) { r.mutable_head_set()->set_gain_mdb(-60'000); }},
        Extreme{"gain_highest", [](wire::Request& r) { r.mutable_head_set()->set_gain_mdb(60'000); }},
        Extreme{"white_balance_least", [](wire::Request& r) { white_balance(r, 256, 256); }},
        Extreme{"white_balance_most", [](wire::Request& r) { white_balance(r, 65'535, 65'535); }},
        Extreme{"gamma_least", [](wire::Request& r) { r.mutable_head_set()->set_gamma(100); }},
        Extreme{"gamma_most", [](wire::Request& r) { r.mutable_head_set()->set_gamma(8000); }},
        Extreme{"rate_1000", [](wire::Request& r) { start_genlock(r, 1000, 1); }},
        Extreme{"rate_1_in_1000s", [](wire::Request& r) { start_genlock(r, 1, 1000); }},
        Extreme{"rate_of_largest_terms", [](wire::Request& r) { start_genlock(r, 999'983, 1'000'000); }},
        Extreme{"pulse_1ns", [](wire::Request& r) { start_genlock(r, 0, 0, 1); }},
        Extreme{"pulse_nearly_a_frame", [](wire::Request& r) { start_genlock(r, 1, 1000, 999'999'999'999); }},
        Extreme{"target_least", [](wire::Request& r) { r.mutable_exposure()->set_target_below(500); }},
        Extreme{"target_most", [](wire::Request& r) { r.mutable_exposure()->set_target_below(8000); }},
        Extreme{"difference_most", [](wire::Request& r) { r.mutable_exposure()->set_difference(8000); }},
        Extreme{"ramp_least", [](wire::Request& r) { r.mutable_exposure()->set_ramp(1); }},
        Extreme{"ramp_most", [](wire::Request& r) { r.mutable_exposure()->set_ramp(8000); }},
        Extreme{"longest_1us", [](wire::Request& r) { r.mutable_exposure()->set_longest_ns(1000); }},
        Extreme{"longest_10s", [](wire::Request& r) { r.mutable_exposure()->set_longest_ns(10'000'000'000); }},
        Extreme{"highest_gain_lowest", [](wire::Request& r) { r.mutable_exposure()->set_highest_gain_mdb(-60'000); }},
        Extreme{"highest_gain_highest", [](wire::Request& r) { r.mutable_exposure()->set_highest_gain_mdb(60'000); }}),
    [](const auto& extreme) { return extreme.param.name; });

/// Values beyond the limits, and the text that each refusal must contain.
struct Beyond {
  Extreme request;
  const char* range;
};

TEST(Extremes, RequestsBeyondTheEnds_AreRefusedWithTheRange) {
  Stand stand;
  TestHost& host = stand.bring_up();
  const Beyond all[] = {
      {{"exposure", [](wire::Request& r) { r.mutable_head_set()->set_exposure_ns(3'600'000'000'001); }},
       "1 ns to 1 hour"},
      {{"exposure", [](wire::Request& r) { r.mutable_head_set()->set_exposure_ns(UINT64_MAX); }}, "1 ns to 1 hour"},
      {{"gain", [](wire::Request& r) { r.mutable_head_set()->set_gain_mdb(60'001); }}, "-60 to 60 dB"},
      {{"gain", [](wire::Request& r) { r.mutable_head_set()->set_gain_mdb(INT32_MIN); }}, "-60 to 60 dB"},
      {{"highest", [](wire::Request& r) { r.mutable_exposure()->set_highest_gain_mdb(INT32_MIN); }}, "-60 to 60 dB"},
      {{"highest", [](wire::Request& r) { r.mutable_exposure()->set_highest_gain_mdb(INT32_MAX); }}, "-60 to 60 dB"},
      {{"gamma", [](wire::Request& r) { r.mutable_head_set()->set_gamma(UINT32_MAX); }}, "100 to 8000"},
      {{"white balance", [](wire::Request& r) { white_balance(r, UINT32_MAX, 4096); }}, "256 to 65535"},
      {{"target", [](wire::Request& r) { r.mutable_exposure()->set_target_below(UINT32_MAX); }}, "500 to 8000"},
      {{"ramp", [](wire::Request& r) { r.mutable_exposure()->set_ramp(UINT32_MAX); }}, "1 to 8000"},
      {{"difference", [](wire::Request& r) { r.mutable_exposure()->set_difference(UINT32_MAX); }}, "0 to 8000"},
      {{"longest", [](wire::Request& r) { r.mutable_exposure()->set_longest_ns(UINT64_MAX); }}, "1 us to 10 s"},
      {{"pulse", [](wire::Request& r) { start_genlock(r, 0, 0, UINT64_MAX); }}, "shorter than a frame"},
      {{"trial",
        [](wire::Request& r) {
          r.mutable_upload_commit()->set_sha256(std::string(32, 'x'));
          r.mutable_upload_commit()->set_trial_ns(UINT64_MAX);
        }},
       "1 s to 24 hours"},
  };
  for (const Beyond& beyond : all) {
    const wire::Error error = host.ask(made_by(beyond.request)).error();
    EXPECT_EQ(error.code(), static_cast<unsigned>(Errc::kBadValue)) << beyond.request.name;
    EXPECT_NE(error.message().find(beyond.range), std::string::npos) << error.message();
  }
}

/// A rig.toml of the small rig; `head` is inserted into its first head, `rest` before the first table.
std::string rig_toml(const std::string& rig, const std::string& head, const std::string& rest) {
  std::string toml = "[rig]\nname = \"ends\"\n" + rig + "\n[raymap]\nwidth = 128\nheight = 64\nformat = \"RGB24\"\n" +
                     rest + "\n[sim]\ncalibration = \"truth.json\"\n";
  for (int i = 0; i < kHeads; ++i) {
    const std::string name = "cam" + std::to_string(i);
    toml += "[[heads]]\nname = \"" + name + "\"\nport = \"sim:" + name + "\"\nformat = \"RGB24\"\n" +
            (i == 0 ? head : "") + "\n";
  }
  return toml;
}

struct Toml {
  const char* name;
  const char* rig;
  const char* head;
  const char* rest;
  friend std::ostream& operator<<(std::ostream& out, const Toml& toml) { return out << toml.name; }
};

class AcceptedRigToml : public testing::TestWithParam<Toml> {};

TEST_P(AcceptedRigToml, AtTheEndOfItsRange_TheRigRunsOnOverADay) {
  const Toml& toml = GetParam();
  auto config = firmware::parse_rig_config(rig_toml(toml.rig, toml.head, toml.rest), "rig.toml");
  ASSERT_TRUE(config) << config.error().text();
  StandOptions options;
  options.config = std::move(*config);
  Stand stand(std::move(options));
  TestHost& host = stand.connect();
  EXPECT_TRUE(host.upload(to_json(small_calibration())).has_done());
  expect_that_it_runs_on(stand);
}

INSTANTIATE_TEST_SUITE_P(
    RigToml, AcceptedRigToml,
    testing::Values(
        Toml{"rate_1000", "rate = \"1000\"", "", "[trigger]\nstart = true"},
        Toml{"rate_1_in_1000s", "rate = \"1/1000\"", "", "[trigger]\nstart = true"},
        Toml{"rate_of_largest_terms", "rate = \"999983/1000000\"", "", "[trigger]\nstart = true"},
        Toml{"free_run_1000", "rate = \"1000\"", "", "[trigger]\nsource = \"none\"\nstart = true"},
        Toml{"free_run_1_in_1000s", "rate = \"1/1000\"", "", "[trigger]\nsource = \"none\"\nstart = true"},
        Toml{"pulse_1us", "", "", "[trigger]\nstart = true\npulse_width_us = 1"},
        Toml{"pulse_100ms", "rate = \"1/1000\"", "", "[trigger]\nstart = true\npulse_width_us = 100000"},
        Toml{"delay_1s", "rate = \"1/1000\"", "trigger_delay_us = 1000000", "[trigger]\nstart = true"},
        Toml{"delay_nearly_a_frame", "rate = \"25\"", "trigger_delay_us = 39999", "[trigger]\nstart = true"},
        Toml{"exposure_1us", "", "exposure_us = 1", ""}, Toml{"exposure_10s", "", "exposure_us = 10000000", ""},
        Toml{"gain_lowest", "", "gain_mdb = -60000", ""}, Toml{"gain_highest", "", "gain_mdb = 60000", ""},
        Toml{"white_balance_least", "", "red_q12 = 256\nblue_q12 = 256", ""},
        Toml{"white_balance_most", "", "red_q12 = 65535\nblue_q12 = 65535", ""},
        Toml{"gamma_least", "", "gamma = 0.1", ""}, Toml{"gamma_most", "", "gamma = 8.0", ""},
        Toml{"program_least", "", "",
             "[exposure]\nprogram = \"joint\"\ntarget_stops = 0.5\ndifference_stops = 0\nramp_stops = 0.001\n"
             "longest_us = 1\nhighest_gain_mdb = -60000"},
        Toml{"program_most", "", "",
             "[exposure]\nprogram = \"joint\"\ntarget_stops = 8\ndifference_stops = 8\nramp_stops = 8\n"
             "longest_us = 10000000\nhighest_gain_mdb = 60000"}),
    [](const auto& toml) { return toml.param.name; });

}  // namespace
}  // namespace nodal::scenario
