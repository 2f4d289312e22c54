# A rig of its own: an axis with Coulomb and viscous friction, its PI loop, its units and its names.
#
#   awk -f rig.awk [-v fault=...] excitation.csv > recording.csv
#
# It shares no code with the program, reads the first two columns of an excitation and writes what a
# laboratory's logger would: milliseconds, degrees, amperes, column names in its own words.
# Set with -v: mode ("rate" or "torque"), start (rad), seed (of its noise),
# fault ("", "sign", "half", "clip", "rate", "late").
BEGIN {
    FS = ","
    if (mode == "") mode = "rate"
    inertia = 2.0          # kg m^2
    coulomb = 6.0          # N m
    viscous = 4.0          # N m s/rad
    per_ampere = 3.0       # N m/A at the load
    kp = 400.0; ki = 6000.0
    degrees = 57.29577951308232
    substeps = 20
    if (seed == "") seed = 12345
    rows = 0
}
function noise(size) {     # uniform, of zero mean; a generator of its own, so that runs are alike
    seed = (seed * 16807) % 2147483647
    return size * (seed / 2147483647 - 0.5)
}
FNR == 1 { next }
{ time[rows] = $1; asked[rows] = $2; rows++ }
END {
    step = time[1] - time[0]
    h = step / substeps
    late = fault == "late" ? int(0.2 / step) : 0
    every = fault == "rate" ? 2 : 1
    last = fault == "half" ? int(rows / 2) : rows
    angle = start + 0
    rate = sum = 0
    print "t [ms];Sollwert;Winkel [deg];Drehzahl [deg/s];Strom [A]"
    for (k = 0; k < rows; k++) {
        command = k < late ? 0 : asked[k - late]
        if (fault == "sign") command = -command
        for (i = 0; i < substeps; i++) {
            if (mode == "rate") {
                error = command - rate
                sum += error * h
                drive = kp * error + ki * sum
            } else drive = command
            if (fault == "clip") {
                if (drive > 6.3) drive = 6.3
                if (drive < -6.3) drive = -6.3
            }
            # Coulomb friction holds what it can hold, and stops what it would turn round.
            rest = drive - viscous * rate
            if (rate == 0) {
                push = rest > coulomb ? rest - coulomb : (rest < -coulomb ? rest + coulomb : 0)
                next_rate = push / inertia * h
            } else {
                next_rate = rate + (rest - (rate > 0 ? coulomb : -coulomb)) / inertia * h
                if (next_rate * rate < 0) next_rate = 0
            }
            angle += 0.5 * (rate + next_rate) * h
            rate = next_rate
        }
        if (k < last && k % every == 0)
            printf "%.4f;%.7g;%.7g;%.7g;%.6f\n", 1000 * time[k] + 250, \
                command * (mode == "rate" ? degrees : 1), angle * degrees, \
                rate * degrees + noise(0.02), drive / per_ampere + (fault == "clip" ? 0 : noise(0.02))
    }
}
