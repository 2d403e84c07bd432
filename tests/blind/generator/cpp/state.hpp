// The state vector: table, two drives, controller, and what single effects add.
#pragma once

#include <array>
#include <cstddef>

namespace blind {

enum Common : std::size_t {
    table_angle,
    table_speed,
    table_bristle,  // LuGre
    extra_angle,
    extra_speed,  // a second mass or the foundation
    tension,
    equaliser,  // T_t, x_e
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
    motor_bristle,
    pinion_bristle,
    flank_state,
    drive_size
};

constexpr std::size_t of(std::size_t drive, Own what) { return drives_begin + drive * drive_size + what; }
constexpr std::size_t state_size = of(2, motor_angle);
using State = std::array<double, state_size>;

// Bodies that dry friction can hold fast.
enum Body : std::size_t { table_body, motor_body, pinion_body = motor_body + 2, body_count = pinion_body + 2 };

// Direction of sliding, 0 while stuck, `nothing` without dry friction.
constexpr int nothing = 2;
using Sliding = std::array<int, body_count>;

constexpr std::size_t speed_of(std::size_t body) {
    if (body == table_body) return table_speed;
    return body < pinion_body ? of(body - motor_body, motor_speed) : of(body - pinion_body, pinion_speed);
}

}  // namespace blind
