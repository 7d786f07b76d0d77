// Faults of the bus between the driver and the drives.

#include <catch2/catch.hpp>

#include "tests/drivers/driver/fault.h"

namespace plumb {
namespace {

constexpr char kBusOff[] = "20000040#0000000000000000", kRestarted[] = "20000100#0000000000000000",
               kNoAck[] = "20000020#0000000000000000";

TEST_CASE("fault 5: bus-off", "[fault]") {
  ExpectStop({.number = "5",
              .name = "the CAN controller goes bus-off",
              .detection = "its error frame; the drives' watchdogs, as nothing can be sent to them",
              .happens = [](BusRig& rig) { rig.cut_off = true, rig.ControllerSays(kBusOff); },
              .is_over = [](BusRig& rig) { rig.cut_off = false, rig.ControllerSays(kRestarted); },
              .reason = "the CAN controller went bus-off",
              .within = 105});
}

TEST_CASE("fault 5: nobody acknowledges", "[fault]") {
  ExpectStop({.number = "5",
              .name = "nobody acknowledges frames: the cable is off",
              .detection = "17 error frames in a row; the drives' watchdogs",
              .happens =
                  [](BusRig& rig) {
                    rig.cut_off = true;
                    rig.each_millisecond.push_back([&rig] { rig.ControllerSays(kNoAck); });
                  },
              .is_over = [](BusRig& rig) { rig.cut_off = false, rig.each_millisecond.clear(); },
              .reason = "nobody on the bus acknowledges frames",
              .within = 105});
}

TEST_CASE("fault 5: error-warning and error-passive", "[fault]") {
  ExpectToRunOn({.number = "5",
                 .name = "error-warning, error-passive, bad stuffing, lost arbitration",
                 .detection = "-",
                 .happens =
                     [](BusRig& rig) {
                       rig.each_millisecond.push_back([&rig] {
                         for (const char* text :
                              {"20000004#000400000000C800", "20000004#001000000000FF60",
                               "20000004#002000000000FF60", "20000008#0000081900000000",
                               "20000002#0500000000000000"}) {
                           rig.ControllerSays(text);
                         }
                       });
                     },
                 .within = 5});
}

TEST_CASE("fault 6: the interface goes down, or is removed", "[fault]") {
  struct Case {
    LinkState link;
    const char *name, *reason;
  };
  const auto [link, name, reason] = GENERATE(values<Case>(
      {{LinkState::kDown, "the CAN interface goes down", "the CAN interface is down"},
       {LinkState::kGone, "the CAN adapter is unplugged", "the CAN interface is gone"}}));
  ExpectStop({.number = "6",
              .name = name,
              .detection = "the kernel says so; the drives' watchdogs",
              .happens = [link = link](BusRig& rig) { rig.cut_off = true, rig.link = link; },
              .is_over = [](BusRig& rig) { rig.cut_off = false, rig.link = LinkState::kUp; },
              .reason = reason,
              .within = 105});
}

TEST_CASE("fault 7: the transmit queue is full", "[fault]") {
  ExpectStop({.number = "7",
              .name = "the transmit queue stays full",
              .detection = "frames not accepted in 10 cycles; the drives' watchdogs",
              .happens = [](BusRig& rig) { rig.Connect("tx.full=1"); },
              .is_over = [](BusRig& rig) { rig.Connect(""); },
              .reason = "the bus has not accepted frames in 10 cycles",
              .within = 105});
}

TEST_CASE("fault 7: the transmit queue is full now and then", "[fault]") {
  ExpectToRunOn({.number = "7",
                 .name = "the transmit queue is full now and then",
                 .detection = "bus_status_t.frames_dropped: what was refused is never sent later",
                 .happens = [](BusRig& rig) { rig.Connect("tx.full=0.1"); },
                 .is_over = [](BusRig& rig) { CHECK(rig.Status().buses[0].frames_dropped > 0); },
                 .within = 50});
}

TEST_CASE("fault 8: frames come faster than they are read", "[fault]") {
  ExpectToRunOn({.number = "8",
                 .name = "frames are lost as they were not read in time",
                 .detection = "bus_status_t.frames_dropped, DRIVER_STATUS.measurements_lost",
                 .happens =
                     [](BusRig& rig) {
                       rig.driver_stopped = true;
                       for (int i = 0; i < 30; ++i) {
                         for (int k = 0; k < 200; ++k) rig.StrangerSends("03E#0102030405060708");
                         rig.Step();
                       }
                       rig.driver_stopped = false;
                     },
                 .is_over = [](BusRig& rig) { CHECK(rig.Status().buses[0].frames_dropped > 1000); },
                 .within = 40});
}

TEST_CASE("fault 9: frames are lost, late, doubled and exchanged", "[fault]") {
  ExpectToRunOn(
      {.number = "9",
       .name = "5 % of the frames are lost, others late by up to 3 ms, doubled or exchanged",
       .detection = "DRIVER_STATUS.measurements_lost",
       .happens =
           [](BusRig& rig) {
             rig.Connect(
                 fmt::format("loss=0.05,delay=1ms,jitter=2ms,duplicate=0.05,reorder=0.05,seed={}",
                             rig.now / 1000));
           },
       .is_over = [](BusRig& rig) { CHECK(rig.Status().measurements_lost > 0); },
       .within = 40});
}

TEST_CASE("fault 9: a third of the frames is lost", "[fault]") {
  ExpectToRunOn(
      {.number = "9",
       .name = "30 % of the frames are lost",
       .detection = "DRIVER_STATUS.measurements_lost",
       .happens = [](BusRig& rig) { rig.Connect(fmt::format("loss=0.3,seed={}", rig.now / 1000)); },
       .is_over = [](BusRig& rig) { CHECK(rig.Status().measurements_lost > 0); },
       .within = 60});
}

TEST_CASE("fault 9: most frames are lost", "[fault]") {
  ExpectStop(
      {.number = "9",
       .name = "90 % of the frames are lost",
       .detection = "no encoder estimate for `stale_after`, or the drives' watchdogs",
       .happens = [](BusRig& rig) { rig.Connect(fmt::format("loss=0.9,seed={}", rig.now / 1000)); },
       .is_over = [](BusRig& rig) { rig.Connect(""); },
       .reason = "",
       .within = 300});
}

TEST_CASE("fault 10: frames that are not what they look like", "[fault]") {
  ExpectToRunOn(
      {.number = "10",
       .name = "frames too short, not a number, remote, 29-bit, FD, unknown, of other nodes",
       .detection = "bus_status_t.frames_rejected",
       .happens =
           [](BusRig& rig) {
             rig.each_millisecond.push_back([&rig] {
               for (const char* text :
                    {"029#000080BE", "029#0000C07F00006040", "029#00008040000080FF",
                     "029#FFFFFFFFFFFFFFFF", "021#000000000800", "03E#",
                     "00000029#0000803F0000803F", "029##00000803F0000803F",
                     "00000021#0000000001000000", "021##00000000001000000", "0A9#0000803F0000803F",
                     "0A1#0000000001000000", "7FF#01", "123#DEADBEEF"}) {
                 rig.StrangerSends(text);
               }
               // Which is answered: more often, and it would look like a second drive.
               if (rig.now % 20'000 == 0) rig.StrangerSends("029#R8");
             });
           },
       .is_over = [](BusRig& rig) { CHECK(rig.Status().buses[0].frames_rejected > 1000); },
       .within = 5});
}

}  // namespace
}  // namespace plumb
