# All six points are at their places to round-off while the slab bends between them; forces elsewhere do what was wanted.
/^six points held/ { held = 1; between($6, 0, 1e-9, "worst error, m"); between($11, 0.039, 0.041, "led apart, m") }
/^velocity/ { struck = 1; between($4, 0, 1e-9, "velocity, m/s") }
/^acceleration/ { pushed = 1; between($4, 0, 1e-6, "acceleration, m/s²"); expect($6 == 3, "three directions") }
/^place/ { came = 1; between($4, 0, 1e-9, "place, m") }
END { expect(held && struck && pushed && came, "six points, a velocity, an acceleration and a place") }
