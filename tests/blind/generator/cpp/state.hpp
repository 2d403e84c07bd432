// The state vector: table, two drives, controller, and what single effects add.
#pragma once

#include <array>
#include <cstddef>

#include "parameters.hpp"

namespace blind {

enum Common : std::size_t {
    table_angle,
    table_speed,
    table_bristle,  // LuGre
    extra_angle,
    extra_speed,       // a second mass or the foundation
    table_hysteresis,  // Bouc-Wen
    maxwell_1,         // Maxwell slip
    maxwell_2,
    maxwell_3,
    maxwell_4,
    tension,
    position_integral,
    derivative_filter,  // T_t, x_p, z
    drives_begin
};
enum Own : std::size_t {
    motor_angle,
    motor_speed,
    pinion_angle,
    pinion_speed,  // both in the pinion's frame
    current,
    speed_integral,
    current_integral,
    equaliser,  // of slaves
    motor_bristle,
    pinion_bristle,
    flank_state,
    drive_size
};

constexpr std::size_t of(std::size_t drive, Own what) { return drives_begin + drive * drive_size + what; }
constexpr std::size_t state_size = of(max_drives, motor_angle);
using State = std::array<double, state_size>;

// Bodies that dry friction can hold fast.
enum Body : std::size_t {
    table_body,
    motor_body,
    pinion_body = motor_body + max_drives,
    body_count = pinion_body + max_drives
};

// Direction of sliding, 0 while stuck, `nothing` without dry friction.
constexpr int nothing = 2;
using Sliding = std::array<int, body_count>;

constexpr std::size_t speed_of(std::size_t body) {
    if (body == table_body) return table_speed;
    return body < pinion_body ? of(body - motor_body, motor_speed) : of(body - pinion_body, pinion_speed);
}

}  // namespace blind
