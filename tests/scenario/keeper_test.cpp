// What a rig says of the calibrations it keeps: queries, a store that cannot be read, several that do not fit.
#include <gtest/gtest.h>

#include <string>

#include "firmware/calibration/rehearsal.h"
#include "tests/scenario/stand.h"

namespace nodal::scenario {
namespace {

wire::Reply document_of(TestHost& host, const std::string& id) {
  wire::Request get;
  get.mutable_calibration_get()->set_id(id);
  return host.ask(get);
}

TEST(CalibrationKeeper, ADocumentIsAskedFor_ItIsTheOneInForceOrTheNamedOneOrAnError) {
  Stand stand;
  TestHost& host = stand.connect();
  const wire::Reply none = document_of(host, "");
  ASSERT_TRUE(none.has_error());
  EXPECT_EQ(none.error().message(), "no calibration is in force");
  stand.bring_up();
  const std::string in_force = host.status().calibration_id();
  for (const std::string& id : {std::string(), in_force, in_force.substr(0, 3)}) {
    const wire::Reply found = document_of(host, id);
    ASSERT_FALSE(found.has_error()) << found.error().message();
    EXPECT_EQ(found.calibration().id(), in_force);
    EXPECT_EQ(found.calibration().json(), canonical_json(small_calibration()));
  }
  std::string unknown = in_force;
  unknown.front() = static_cast<char>(unknown.front() ^ 1);
  EXPECT_TRUE(document_of(host, unknown).has_error());
}

TEST(CalibrationKeeper, TheStoreCannotBeOpened_TheRigSaysSoAndServesHosts) {
  auto disk = std::make_unique<hal::sim::SimDisk>();
  disk->put("calibrations", {});  // not a folder
  Stand stand({}, std::move(disk));
  TestHost& host = stand.connect();
  ASSERT_TRUE(stand.run_until([&] { return host.status().state() == "no-calibration"; })) << host.status().state();
  EXPECT_EQ(host.status().problem().find("calibration store: "), 0U) << host.status().problem();
  EXPECT_TRUE(host.upload(to_json(small_calibration())).has_error());
}

TEST(CalibrationKeeper, NoneOfThoseStoredFits_EachReasonIsNamed) {
  std::unique_ptr<hal::sim::SimDisk> disk;
  {
    Stand stand;
    TestHost& host = stand.bring_up();
    EXPECT_FALSE(host.upload(to_json(small_calibration("another"))).has_error());
    disk = stand.disk->after_power_loss(1);
  }
  StandOptions other;
  for (firmware::HeadConfig& head : other.config.heads) head.name += "-new";
  Stand stand(other, std::move(disk));
  TestHost& host = stand.connect();
  ASSERT_TRUE(stand.run_until([&] { return host.status().state() == "no-calibration"; })) << host.status().state();
  const std::string problem = host.status().problem();
  const std::size_t between = problem.find("; ");
  ASSERT_NE(between, std::string::npos) << problem;
  EXPECT_GT(between, 0U) << problem;
  EXPECT_NE(problem.find("cam0", between), std::string::npos) << problem;
  EXPECT_LT(problem.find("cam0"), between) << problem;
}

TEST(CalibrationKeeper, TheOneInForceIsLoadedAgain_NothingOfTheStoreIsWritten) {
  std::unique_ptr<hal::sim::SimDisk> disk;
  {
    Stand stand;
    stand.bring_up();
    disk = stand.disk->after_power_loss(1);
  }
  disk->set_capacity(disk->total_bytes().value() - disk->free_bytes().value());  // it is full
  Stand stand({}, std::move(disk));
  TestHost& host = stand.connect();
  ASSERT_TRUE(stand.run_until([&] { return !host.status().calibration_id().empty(); }));
  stand.run(Duration::seconds(2));
  EXPECT_EQ(host.status().problem().find("calibration"), std::string::npos) << host.status().problem();
}

TEST(CalibrationKeeper, HostsThatHaveGoneAsked_NothingIsDoneForThemAndTheNextIsServed) {
  hal::sim::SimDisk disk;
  SpscRing<sets::BlendSetup> tables_out(1), tables_back(8);
  firmware::CalibrationKeeper keeper(small_config(), disk, tables_out, tables_back);
  keeper.step({});
  const auto ask = [&](std::uint64_t ticket, firmware::CalibrationCommand what, bool leaves) {
    firmware::CalibrationRequest request{.ticket = ticket, .what = std::move(what), .heads = {}, .host = {}};
    request.host = firmware::Presence::of_host();
    if (leaves) request.host.end();
    ASSERT_TRUE(keeper.requests().push(std::move(request)));
    while (keeper.step({})) tables_out.pop();
  };
  const auto error_of = [&](std::uint64_t ticket) {
    const auto answer = keeper.answers().pop();
    EXPECT_TRUE(answer);
    if (!answer) return Errc::kInternal;
    EXPECT_EQ(answer->ticket, ticket);
    EXPECT_FALSE(answer->result);
    return answer->result ? Errc::kInternal : answer->result.error().code;
  };
  ask(1, firmware::CalibrationRequest::List{}, true);
  EXPECT_EQ(error_of(1), Errc::kCancelled);
  ask(2, firmware::CalibrationRequest::Install{.json = to_json(small_calibration())}, true);
  EXPECT_EQ(error_of(2), Errc::kCancelled);
  EXPECT_FALSE(disk.list("calibrations").value_or(std::vector<std::string>{}).size()) << "nothing was stored";
  ask(3, firmware::CalibrationRequest::List{}, false);
  const auto answer = keeper.answers().pop();
  ASSERT_TRUE(answer && answer->result);
  EXPECT_TRUE(std::get<firmware::CalibrationAnswer::Listed>(*answer->result).entries.empty());
}

TEST(CalibrationRehearsalBytes, GrowWithTheRaymapsPixels) {
  firmware::RigConfig config;
  config.raymap.width = 300;
  config.raymap.height = 200;
  EXPECT_EQ(firmware::rehearsal_bytes(config),
            firmware::kMaxRehearsalBytes + 60'000 * firmware::kMaxRehearsalBytesAPixel);
}

}  // namespace
}  // namespace nodal::scenario
